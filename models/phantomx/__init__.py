"""PhantomX AX Hexapod Mark II: six legs, eighteen AX-12A servos."""
