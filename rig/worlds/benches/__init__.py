"""Bench rigs for the blind check: one compliance without an arm, far from any simple law.

`draw.draw_case` draws a specimen, how it is driven, sensors and what a simulator believed, and
gives the table, its META and, apart from both, the answers. Laws, paths and noise are of this
package alone: nothing of identification, and nothing measured.
"""
