"""Rooms of a grid map by three methods, and one picture of each."""

import cv2

from layoutexplore import draw_layout, load_plan, reconstruct

if __name__ == "__main__":
    grid = load_plan("office-01").rasterize(0.05).grid
    for method in ("default", "rose2"):
        layout = reconstruct(grid, method)
        cv2.imwrite(f"{method}.png", draw_layout(layout, grid)[..., ::-1])
        areas = sorted((room.polygon.area for room in layout.rooms), reverse=True)
        print(f"{method}: {len(areas)} rooms, the largest of {areas[0]:.0f} m2")
