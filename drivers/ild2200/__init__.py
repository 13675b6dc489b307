"""Micro-Epsilon optoNCDT ILD2200-10 laser over a serial line (pyserial)."""
