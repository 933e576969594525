"""Which effects explain residuals: likelihood, fits, sensitivities, search, significance."""
