//! What the movements claim: whole turns, joint limits, feet on the floor.
