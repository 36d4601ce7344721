"""The analytic terms. They need no measured material, so a test can write their documents."""

from relume.brdf.registry import TERMS

ANALYTIC = {model: term for model, term in TERMS.items() if not term.needs_data}
