"""A running session watched for what its model does not explain."""
