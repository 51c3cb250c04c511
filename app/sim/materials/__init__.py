"""What objects are made of, one material a file; particles of any of them share one grid."""
