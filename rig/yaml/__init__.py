"""YAML files into typed values, with every problem in plain words."""
