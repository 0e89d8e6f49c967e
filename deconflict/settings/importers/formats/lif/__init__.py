"""LIF, the layout interchange format of the VDMA."""
