"""ASCII floor plans of the tests: `#` a wall, a letter a room, `.` a door; each says what it is for."""

from __future__ import annotations

import functools

from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.tracing import floorplan_from_ascii

TWO_ROOMS = """
###########
#aaaa#bbbb#
#aaaa.bbbb#
#aaaa#bbbb#
###########
"""
"""The smallest plan with a door: reading drawings, and commands and environments that end soon."""

TWO_HALLS = """
#####################
#aaaaaaaa#bbbbbbbbbb#
#aaaaaaaa#bbbbbbbbbb#
#aaaaaaaa.bbbbbbbbbb#
#aaaaaaaa.bbbbbbbbbb#
#aaaaaaaa#bbbbbbbbbb#
#####################
"""
"""A wide passage between rooms that no scan sees whole: some frontiers are closed, others lead on."""

ROW_OF_ROOMS = """
#############
#aaaa.bbb#cc#
#aaaa#bbb#cc#
#aaaa#bbb.cc#
#############
"""
"""Rooms one behind the other: in which order they are finished, and that a robot comes back."""

CORNER = """
#######
#aa#bb#
#aa.bb#
####..#
#ccccc#
#######
"""
"""A door and a passage that bends: cells that no two polygons share."""

FLAT = """
##############
#aaa#bbbb#ccc#
#aaa.bbbb#ccc#
#aaa#bbbb#ccc#
###########.##
#ddddddddddd.#
#ddddddddddd##
#########.####
#eeeeeeeeeee##
##############
"""
"""A chain of rooms with one way through."""

HOUSE = FLAT.replace("###########.##", "##.########.##")
"""`FLAT` with a second door: a loop, so that agents differ; benchmarks and their reports."""

SUITE = """
##############
#aaaaa#bbbbbb#
#aaaaa.bbbbbb#
#aaaaa#bbbbbb#
###.####.#####
#cccccccccccc#
##############
"""
"""Three rooms in a loop, one colour each: pictures."""

TWO_OFFICES = """
####################
#aaaaaaaa#bbbbbbbbb#
#aaaaaaaa#bbbbbbbbb#
#aaaaaaaa#bbbbbbbbb#
#aaaaaaaa#bbbbbbbbb#
####.########.######
#cccccccccccccccccc#
####################
"""
"""Two rooms and a corridor: rooms seen in part from their doors."""

THREE_OFFICES = """
#########################
#aaaaaaaa#bbbbbbb#cccccc#
#aaaaaaaa#bbbbbbb#cccccc#
#aaaaaaaa#bbbbbbb#cccccc#
####.########.#######.###
#ddddddddddddddddddddddd#
#ddddddddddddddddddddddd#
#########################
"""
"""Three rooms on one side of a corridor: what is predicted behind a frontier, and agents that read it."""

WIDE_DOORS = """
##############################
#aaaaaaaa#bbbbbbbbb#ccccccccc#
#aaaaaaaa#bbbbbbbbb#ccccccccc#
#aaaaaaaa#bbbbbbbbb#ccccccccc#
#aaaaaaaa#bbbbbbbbb#ccccccccc#
####..########..#######..#####
#dddddddddddddddddddddddddddd#
#dddddddddddddddddddddddddddd#
#dddddddddddddddddddddddddddd#
##############################
"""
"""Doors of two letters, which robots of any size and drift pass: the simulation's rules."""

SIX_ROOMS = """
#########################
#.......#.......#.......#
#.......#.......#.......#
#.......#.......#.......#
####.#######.######.#####
#.......................#
#.......................#
#####.#####.#######.#####
#.......#.......#.......#
#.......#.......#.......#
#.......#.......#.......#
#########################
"""
"""Rooms on both sides of a corridor, all of them one region of the drawing: the environments."""

OFFICES = """
################################
#aaaaaaa#bbbbbbbbb#ccccc#dddddd#
#aaaaaaa#bbbbbbbbb#ccccc#dddddd#
#aaaaaaa#bbbbbbbbb#ccccc#dddddd#
####.#######..######.######.####
#eeeeeeeeeeeeeeeeeeeeeeeeeeeeee#
#eeeeeeeeeeeeeeeeeeeeeeeeeeeeee#
###.########.########.##########
#fffffff#ggggggggg#hhhhhhhhhhhh#
#fffffff#ggggggggg#hhhhhhhhhhhh#
#fffffff#ggggggggg#hhhhhhhhhhhh#
################################
"""
"""Seven rooms of many sizes on both sides of a corridor: whole runs, and choices worth comparing."""


@functools.cache
def offices() -> FloorPlan:
    """`OFFICES` at 0.6 m a letter: 19 m by 7 m."""
    return floorplan_from_ascii(OFFICES, resolution=0.6, name="offices")
