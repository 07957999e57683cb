//! Camera matrices of nine numbers, by rows or by columns.

use tessuto_core::error::{Error, Result};

/// A last row or column is 0 0 1 within this.
const EXACT: f64 = 1e-6;
/// Largest skew, as a fraction of the focal length.
const SKEW: f64 = 1e-3;

/// fx, fy, cx, cy of `m`, by rows (fx 0 cx, 0 fy cy, 0 0 1, as OpenCV has it) or by columns (fx 0 0, 0 fy 0, cx cy
/// 1, as Open3D, Record3D and ARKit have it): the last row, or the last column, is 0 0 1.
///
/// # Errors
/// [`Error::Input`] at `place` if it is neither, or has a skew.
pub(super) fn intrinsics(m: &[f64], place: &str) -> Result<[f64; 4]> {
    let order = "give fx 0 cx, 0 fy cy, 0 0 1, row by row";
    if m.len() != 9 || m.iter().any(|v| !v.is_finite()) {
        let problem = format!("its camera matrix holds {} numbers, 9 expected", m.len());
        return Err(Error::input(place, problem, order));
    }
    let last =
        |k: [usize; 3]| m[k[0]].abs() < EXACT && m[k[1]].abs() < EXACT && (m[k[2]] - 1.0).abs() < EXACT;
    let rows = last([6, 7, 8]);
    if !rows && !last([2, 5, 8]) {
        let problem = format!(
            "its camera matrix has the last row {} {} {} and the last column {} {} {}, and neither is 0 0 1",
            m[6], m[7], m[8], m[2], m[5], m[8]
        );
        return Err(Error::input(place, problem, order));
    }
    let [skew, below, cx, cy] = if rows { [m[1], m[3], m[2], m[5]] } else { [m[3], m[1], m[6], m[7]] };
    if let Some(skew) = [skew, below].into_iter().find(|v| v.abs() > SKEW * m[0].abs()) {
        return Err(Error::input(
            place,
            format!("its camera matrix has a skew of {skew}"),
            "a skew is not supported: calibrate without",
        ));
    }
    Ok([m[0], m[4], cx, cy])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_and_columns() {
        let expected = [400.0, 410.0, 150.5, 168.5];
        let rows = [400.0, 0.0, 150.5, 0.0, 410.0, 168.5, 0.0, 0.0, 1.0];
        assert_eq!(intrinsics(&rows, "c").unwrap(), expected);
        let columns = [400.0, 0.0, 0.0, 0.0, 410.0, 0.0, 150.5, 168.5, 1.0];
        assert_eq!(intrinsics(&columns, "c").unwrap(), expected);
        let told = |m: &[f64]| intrinsics(m, "c").unwrap_err().to_string();
        assert!(told(&[400.0, 0.0, 150.5, 0.0, 410.0, 168.5, 3.0, 0.0, 1.0]).contains("last row 3 0 1"));
        assert!(told(&[400.0, 0.0, 150.5, 0.0, 410.0, 168.5, 0.0, 0.0, 2.0]).contains("neither is 0 0 1"));
        assert!(told(&[400.0, 2.0, 150.5, 0.0, 410.0, 168.5, 0.0, 0.0, 1.0]).contains("skew of 2"));
        assert!(told(&[400.0, 0.0, 0.0, 2.0, 410.0, 0.0, 150.5, 168.5, 1.0]).contains("skew of 2"));
        assert!(told(&rows[..8]).contains("8 numbers"));
    }
}
