"""Questions of an AEB engineer, answered over drawn scenes: what helps, and how much error it takes."""
