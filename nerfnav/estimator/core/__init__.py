"""Core of the estimators: belief, prediction, posterior covariance, filter steps, protocol."""
