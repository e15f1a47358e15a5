"""The paper's pose filter: photometric and process cost, minimised by Adam on the manifold (Eqs. 3-8)."""
