"""The mechanism's geometry, as far as the paper's Table 8 determines it: a family of layouts, and what it predicts."""
