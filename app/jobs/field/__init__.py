"""Make and change fields: gather training data, train, bake, georeference."""
