"""Factors between SI, which is counted in, and the units that people read and write."""

from __future__ import annotations

MM_PER_M = 1e3
M_PER_MM = 1e-3
N_PER_MM = 1e-3  # a stiffness of one N/m
KNM = 1e-3  # a torsional stiffness of one Nm/rad, in kNm/rad
