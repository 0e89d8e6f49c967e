"""Corners of a rectangle."""

from math import cos, sin

Corner = tuple[float, float]


def corners_of(
    x_m: float, y_m: float, yaw_rad: float, length_m: float, width_m: float
) -> tuple[Corner, Corner, Corner, Corner]:
    """x_m and y_m of the corners, counter-clockwise from the left front. The length is along the yaw."""
    c, s = cos(yaw_rad), sin(yaw_rad)
    ahead_x, ahead_y, left_x, left_y = c * length_m / 2, s * length_m / 2, -s * width_m / 2, c * width_m / 2
    return (
        (x_m + ahead_x + left_x, y_m + ahead_y + left_y),
        (x_m - ahead_x + left_x, y_m - ahead_y + left_y),
        (x_m - ahead_x - left_x, y_m - ahead_y - left_y),
        (x_m + ahead_x - left_x, y_m + ahead_y - left_y),
    )
