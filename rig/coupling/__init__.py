"""`rig couple`: the single arm and the coupled pair, in words and figures."""
