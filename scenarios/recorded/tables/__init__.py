"""Tables with columns of others, and as Parquet files."""
