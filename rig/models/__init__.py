"""Robot and model files: read, checked, written, exported, predicted with."""
