"""The procedure at the rig, piece by piece; `rig.runner` puts them together."""
