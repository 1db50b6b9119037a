"""World generation: one folder or module a stage, and the pipeline that runs them."""
