"""Global localization: find a camera in a field from one picture, without a prediction."""
