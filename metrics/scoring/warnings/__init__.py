"""Precision, recall and calibration of warnings."""
