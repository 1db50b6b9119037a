"""How a world is made: one module a stage, and the pipeline that runs them."""
