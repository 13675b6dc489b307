"""The application: protocols, the measuring procedure, data sets, commands."""
