"""Dialogue of operator and application: control, checklist, requests, approval, and what is shown."""
