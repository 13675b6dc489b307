"""Measurements with a hidden effect, for checking a diagnosis blindly.

`draw.draw_case` draws design, effect, size and noise of one measurement and gives its table, its
META and, apart from both, the answers. Laws of its own throughout: nothing of identification.
"""
