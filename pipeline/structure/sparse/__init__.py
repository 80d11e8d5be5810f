"""Direct solution of large symmetric systems: nested dissection and a multifrontal factorisation."""
