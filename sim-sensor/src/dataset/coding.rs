//! Whole numbers as a general compressor likes them: small differences from a prediction, byte by byte.

/// Signed numbers as planes of bytes: 0, -1, 1, -2 become 0, 1, 2, 3; the lowest byte of each number comes first, then
/// the next of each, as many as the largest number needs (at least one).
pub(super) fn to_planes(values: &[i32]) -> (usize, Vec<u8>) {
    let folded: Vec<u32> = values
        .iter()
        .map(|&n| ((n << 1) ^ (n >> 31)) as u32)
        .collect();
    let largest = folded.iter().copied().max().unwrap_or(0);
    let planes = (4 - largest.leading_zeros() as usize / 8).max(1);
    let bytes = (0..planes).flat_map(|plane| folded.iter().map(move |n| (n >> (8 * plane)) as u8));
    (planes, bytes.collect())
}

/// The numbers of `to_planes`; `None` if these are no planes of so many numbers.
pub(super) fn from_planes(bytes: &[u8], count: usize) -> Option<Vec<i32>> {
    let planes = bytes.len().checked_div(count).unwrap_or(1);
    if planes * count != bytes.len() || !(1..=4).contains(&planes) {
        return None;
    }
    let mut folded = vec![0_u32; count];
    for (plane, bytes) in bytes.chunks_exact(count.max(1)).enumerate() {
        for (number, &byte) in folded.iter_mut().zip(bytes) {
            *number |= u32::from(byte) << (8 * plane);
        }
    }
    let unfold = |n: u32| (n >> 1) as i32 ^ -((n & 1) as i32);
    Some(folded.into_iter().map(unfold).collect())
}

/// From each number the one before it is taken away, in rows of this length.
pub(super) fn differences(values: &mut [i32], row: usize) {
    for row in values.chunks_mut(row.max(1)) {
        for i in (1..row.len()).rev() {
            row[i] = row[i].wrapping_sub(row[i - 1]);
        }
    }
}

pub(super) fn sums(values: &mut [i32], row: usize) {
    for row in values.chunks_mut(row.max(1)) {
        for i in 1..row.len() {
            row[i] = row[i].wrapping_add(row[i - 1]);
        }
    }
}

/// For each vertex of a mesh, the neighbours with lower numbers: their mean predicts where it is.
pub(super) struct Predictor {
    /// Vertex and lower neighbour, sorted.
    links: Vec<[u32; 2]>,
    /// Where each vertex's links begin, and the end.
    starts: Vec<u32>,
}

impl Predictor {
    /// All corners are below `vertices`.
    pub(super) fn new(triangles: &[[u32; 3]], vertices: usize) -> Self {
        let edges = triangles
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        let mut links: Vec<[u32; 2]> = edges
            .filter(|[a, b]| a != b)
            .map(|[a, b]| [a.max(b), a.min(b)])
            .collect();
        links.sort_unstable();
        links.dedup();
        let first = |v: usize| links.partition_point(|link| (link[0] as usize) < v) as u32;
        let starts = (0..=vertices).map(first).collect();
        Self { links, starts }
    }

    /// Takes the prediction away from each vertex's row of numbers.
    pub(super) fn take_away(&self, rows: &mut [i32], row: usize) {
        for v in (0..self.vertices()).rev() {
            let (before, at) = rows.split_at_mut(v * row);
            self.for_each(v, before, row, |i, mean| at[i] = at[i].wrapping_sub(mean));
        }
    }

    /// Adds the predictions again.
    pub(super) fn add(&self, rows: &mut [i32], row: usize) {
        for v in 0..self.vertices() {
            let (before, at) = rows.split_at_mut(v * row);
            self.for_each(v, before, row, |i, mean| at[i] = at[i].wrapping_add(mean));
        }
    }

    fn vertices(&self) -> usize {
        self.starts.len() - 1
    }

    /// The mean of the lower neighbours for each place of a row, rounded down.
    fn for_each(&self, v: usize, before: &[i32], row: usize, mut tell: impl FnMut(usize, i32)) {
        let links = &self.links[self.starts[v] as usize..self.starts[v + 1] as usize];
        if links.is_empty() {
            return;
        }
        for i in 0..row {
            let each = links
                .iter()
                .map(|link| i64::from(before[link[1] as usize * row + i]));
            tell(i, each.sum::<i64>().div_euclid(links.len() as i64) as i32);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_hold_every_number() {
        let values = [0, -1, 1, 127, -128, 40_000, i32::MAX, i32::MIN];
        for count in 1..=values.len() {
            let (planes, bytes) = to_planes(&values[..count]);
            assert_eq!(bytes.len(), planes * count);
            assert_eq!(from_planes(&bytes, count).unwrap(), values[..count]);
        }
        assert_eq!(to_planes(&[-128, 127]).0, 1, "one byte is enough for these");
        assert_eq!(from_planes(&[1, 2, 3], 2), None);
        assert_eq!(from_planes(&[], 0), Some(Vec::new()));
    }

    #[test]
    fn predictions_are_taken_away_and_added_to_the_last_bit() {
        let triangles = [[0, 1, 2], [2, 1, 3], [5, 3, 2]];
        let rows: Vec<i32> = (0..12).map(|i| i * i * 7 - 300).collect();
        let predictor = Predictor::new(&triangles, 6);
        let mut coded = rows.clone();
        predictor.take_away(&mut coded, 2);
        differences(&mut coded, 2);
        assert_eq!(coded[..2], [rows[0], rows[1] - rows[0]], "nobody is lower");
        let mean = (rows[2] + rows[4]).div_euclid(2);
        assert_eq!(coded[6], rows[6] - mean);
        sums(&mut coded, 2);
        predictor.add(&mut coded, 2);
        assert_eq!(coded, rows);
    }
}
