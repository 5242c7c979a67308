//! Which things hang together, found by joining neighbours.

/// Union-find with path halving; a set's root is its smallest member, so labels do not depend on order.
#[derive(Clone, Debug, Default)]
pub(crate) struct DisjointSets {
    parents: Vec<u32>,
}

impl DisjointSets {
    pub(crate) fn new(count: usize) -> Self {
        let mut sets = Self::default();
        sets.reset(count);
        sets
    }

    /// Starts again with every member in a set of its own.
    pub(crate) fn reset(&mut self, count: usize) {
        self.parents.clear();
        self.parents.extend(0..count as u32);
    }

    pub(crate) fn root(&mut self, mut member: u32) -> u32 {
        while self.parents[member as usize] != member {
            let grandparent = self.parents[self.parents[member as usize] as usize];
            self.parents[member as usize] = grandparent;
            member = grandparent;
        }
        member
    }

    pub(crate) fn join(&mut self, a: u32, b: u32) {
        let (parent, other) = (self.parents[a as usize], self.parents[b as usize]);
        if parent == other {
            return;
        }
        // A root above the other member is above the other's root too: most new cells are.
        if parent == a && b < a {
            self.parents[a as usize] = other;
            return;
        }
        let (a, b) = (self.root(a), self.root(b));
        self.parents[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_are_the_smallest_members_in_whatever_order_sets_are_joined() {
        let pairs = [(7, 3), (3, 9), (4, 5), (5, 6), (9, 5), (1, 0), (8, 8)];
        for turn in 0..pairs.len() {
            for swapped in [false, true] {
                let mut sets = DisjointSets::new(10);
                for step in 0..pairs.len() {
                    let (a, b) = pairs[(step + turn) % pairs.len()];
                    let (a, b) = if swapped { (b, a) } else { (a, b) };
                    sets.join(a, b);
                }
                let roots: Vec<u32> = (0..10).map(|member| sets.root(member)).collect();
                assert_eq!(roots, [0, 0, 2, 3, 3, 3, 3, 3, 8, 3]);
            }
        }
    }
}
