"""Materials of objects, one a file; particles of any of them share one grid."""
