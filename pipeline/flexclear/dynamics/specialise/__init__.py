"""Numbers, symbols and tapes of their operations, which become code for one topology."""
