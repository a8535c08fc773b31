"""Systems with symmetry, their continuous and discrete equations, and what they conserve."""
