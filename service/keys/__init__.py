"""Who may ask for what, where others than this machine can ask: keys, sign-ins, the audit log."""
