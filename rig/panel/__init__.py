"""The operator's page: served beside the measurement by a process of its own."""
