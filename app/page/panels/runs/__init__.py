"""Result panels: stored flights, experiments, exports, screenshots."""
