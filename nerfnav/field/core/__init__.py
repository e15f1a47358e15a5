"""Field protocol, metadata, occupancy states and codec: what every kind of field and all that use one share."""
