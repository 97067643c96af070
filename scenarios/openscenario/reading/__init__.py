"""OpenSCENARIO files, read into the model."""
