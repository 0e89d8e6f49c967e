"""Advice: who should wait, where and how long, at the least cost. Pure: data and the time in, a recommendation out."""
