"""Evidence of each cause, its calibrated probability, refits, and the decision between causes."""
