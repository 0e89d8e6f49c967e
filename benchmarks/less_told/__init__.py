"""Whether a robot that reports more is warned no worse: two robots at a time, with and without each optional field."""
