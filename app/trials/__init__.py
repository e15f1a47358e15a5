"""Experiments in the app: which there are, one under way, and the results of earlier ones.

    state    what the session holds of them, and the commands that change it
    drawer   the folder of results; the worker alone touches it
"""
