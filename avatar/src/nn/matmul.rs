//! Dense products on the `gemm` crate, one thread each; parallelism is the caller's.

/// A matrix inside a slice: element (r, c) lies at `r * row_stride + c * column_stride`.
#[derive(Clone, Copy)]
pub(crate) struct View<'a> {
    data: &'a [f32],
    rows: usize,
    columns: usize,
    row_stride: usize,
    column_stride: usize,
}

impl<'a> View<'a> {
    /// The first `rows` rows of a row-major matrix.
    #[inline]
    pub(crate) fn new(data: &'a [f32], rows: usize, columns: usize) -> Self {
        assert!(
            data.len() >= rows * columns,
            "matrix of {rows} x {columns} in {}",
            data.len()
        );
        Self { data, rows, columns, row_stride: columns, column_stride: 1 }
    }

    #[inline]
    pub(crate) fn transposed(self) -> Self {
        Self {
            rows: self.columns,
            columns: self.rows,
            row_stride: self.column_stride,
            column_stride: self.row_stride,
            ..self
        }
    }
}

/// What happens to the values that are there already.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Write {
    Replace,
    Add,
}

/// `out = left right` or `out += left right`; `out` is row-major, `left.rows` x `right.columns`.
#[inline]
#[expect(
    unsafe_code,
    reason = "the gemm crate takes pointers; sizes are checked here"
)]
pub(crate) fn multiply(out: &mut [f32], write: Write, left: View<'_>, right: View<'_>) {
    let (rows, columns, inner) = (left.rows, right.columns, left.columns);
    assert_eq!(inner, right.rows, "inner sizes of a product");
    assert!(
        out.len() >= rows * columns,
        "product of {rows} x {columns} in {}",
        out.len()
    );
    // SAFETY: `View` holds rows * columns <= data.len() with strides (columns, 1) or their transpose, so
    // every element read lies in its slice; the last element written is rows * columns - 1 < out.len();
    // `out` is borrowed mutably, so it overlaps neither operand.
    unsafe {
        gemm::gemm(
            rows,
            columns,
            inner,
            out.as_mut_ptr(),
            1,
            columns as isize,
            write == Write::Add,
            left.data.as_ptr(),
            left.column_stride as isize,
            left.row_stride as isize,
            right.data.as_ptr(),
            right.column_stride as isize,
            right.row_stride as isize,
            1.0_f32,
            1.0_f32,
            false,
            false,
            false,
            gemm::Parallelism::None,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(count: usize, seed: f32) -> Vec<f32> {
        (0..count)
            .map(|i| (i as f32 * 0.713 + seed).sin())
            .collect()
    }

    #[test]
    fn products_of_views_match_the_sum_over_the_inner_index() {
        let (m, n, k) = (5, 7, 11);
        let (a, b) = (numbers(m * k, 0.1), numbers(n * k, 0.7));
        let mut out = vec![1.0; m * n];
        multiply(
            &mut out,
            Write::Add,
            View::new(&a, m, k),
            View::new(&b, n, k).transposed(),
        );
        for i in 0..m {
            for j in 0..n {
                let sum: f64 = (0..k)
                    .map(|q| a[i * k + q] as f64 * b[j * k + q] as f64)
                    .sum();
                // Eleven products of numbers below one: f32 rounding stays below 1e-6.
                assert!((out[i * n + j] as f64 - 1.0 - sum).abs() < 1e-5);
            }
        }
    }

    #[test]
    #[should_panic(expected = "inner sizes")]
    fn mismatched_sizes_are_refused() {
        let a = [0.0; 6];
        multiply(
            &mut [0.0; 9],
            Write::Replace,
            View::new(&a, 3, 2),
            View::new(&a, 3, 2),
        );
    }
}
