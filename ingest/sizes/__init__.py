"""The one rule of size: what bodies and loads may measure, and how a stated size beyond that is read."""
