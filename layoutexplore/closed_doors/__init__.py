"""Rooms behind closed doors, predicted from the regular structure of the rest of the plan (ECMR 2021)."""

from layoutexplore.closed_doors.prediction import ClosedRooms, predict_closed_rooms

__all__ = ["ClosedRooms", "predict_closed_rooms"]
