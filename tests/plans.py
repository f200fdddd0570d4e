"""Floor plans in ASCII that the tests share."""

from __future__ import annotations

import functools

from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.tracing import floorplan_from_ascii

PLAN = """
#########################
#aaaaaaaa#bbbbbbb#cccccc#
#aaaaaaaa#bbbbbbb#cccccc#
#aaaaaaaa#bbbbbbb#cccccc#
####.########.#######.###
#dddddddddddddddddddddddd#
#dddddddddddddddddddddddd#
#########################
""".replace("#dddddddddddddddddddddddd#", "#ddddddddddddddddddddddd#")


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


HOUSE = FLAT.replace("###########.##", "##.########.##")


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


@functools.cache
def offices() -> FloorPlan:
    return floorplan_from_ascii(OFFICES, resolution=0.6, name="offices")
