//! Data sets that are stored in pieces, joined to one: the parts that parallel programs write.
//!
//! The pieces of an image may overlap, as those with ghost layers do, but none of its points may be missing. Arrays are
//! joined where all pieces have them alike. Those of a mesh are joined where meshes are read.

use super::Problem;
use crate::volume::Array;

/// A part of an image.
pub(super) struct Piece {
    /// The first and last point along x, y and z.
    pub extent: [i64; 6],
    pub point_arrays: Vec<Array>,
    pub cell_arrays: Vec<Array>,
}

/// A box of points or cells: where it begins, and how many there are along each axis.
#[derive(Clone, Copy)]
struct Block {
    from: [i64; 3],
    size: [usize; 3],
}

impl Block {
    fn points(extent: [i64; 6]) -> Self {
        let size = |a: usize| extent[2 * a + 1].checked_sub(extent[2 * a]).and_then(|n| n.checked_add(1)).unwrap_or(0);
        Self { from: [0, 2, 4].map(|i| extent[i]), size: [0, 1, 2].map(|a| usize::try_from(size(a)).unwrap_or(0)) }
    }

    /// The cells between these points. Along an axis with a single point of the whole there is one; where only the piece has a
    /// single point there is none.
    fn cells(extent: [i64; 6], whole: [i64; 6]) -> Self {
        let points = Self::points(extent);
        let flat = Self::points(whole).size.map(|n| n == 1);
        let size = |a: usize| if flat[a] { points.size[a].min(1) } else { points.size[a].saturating_sub(1) };
        Self { from: points.from, size: [0, 1, 2].map(size) }
    }

    fn count(&self) -> Option<usize> {
        self.size.iter().try_fold(1usize, |product, &n| product.checked_mul(n))
    }

    /// Where this block begins in the other, along each axis; none if it isn't inside.
    fn within(&self, whole: &Self) -> Option<[usize; 3]> {
        let mut at = [0; 3];
        for a in 0..3 {
            at[a] = usize::try_from(self.from[a].checked_sub(whole.from[a])?).ok()?;
            at[a].checked_add(self.size[a]).filter(|&end| end <= whole.size[a])?;
        }
        Some(at)
    }
}

/// Arrays on points and arrays in cells.
type Arrays = (Vec<Array>, Vec<Array>);

/// The arrays of a whole image. `charge` is asked before memory is.
pub(super) fn image(
    whole: [i64; 6],
    mut pieces: Vec<Piece>,
    charge: impl Fn(&str, u64) -> Result<(), Problem>,
) -> Result<Arrays, Problem> {
    if let [one] = pieces.as_slice()
        && one.extent == whole
    {
        return Ok(pieces.pop().map(|one| (one.point_arrays, one.cell_arrays)).unwrap_or_default());
    }
    let of_points: Vec<_> = pieces.iter().map(|p| (Block::points(p.extent), p.point_arrays.as_slice())).collect();
    let of_cells: Vec<_> = pieces.iter().map(|p| (Block::cells(p.extent, whole), p.cell_arrays.as_slice())).collect();
    let point_arrays = blocks("points", Block::points(whole), &of_points, &charge)?;
    Ok((point_arrays, blocks("cells", Block::cells(whole, whole), &of_cells, &charge)?))
}

/// The arrays of a block out of those of its pieces.
fn blocks(
    what: &'static str,
    whole: Block,
    pieces: &[(Block, &[Array])],
    charge: &impl Fn(&str, u64) -> Result<(), Problem>,
) -> Result<Vec<Array>, Problem> {
    let wrong = |problem: String| Problem::Pieces { problem };
    let too_many = || wrong(format!("have more {what} than can be"));
    let count = whole.count().ok_or_else(too_many)?;
    let pieces: Vec<_> = pieces.iter().filter(|(block, _)| block.count() != Some(0)).collect();
    // Before room is made for the whole: can the pieces fill it at all?
    let most = pieces.iter().map(|(block, _)| block.count().unwrap_or(0)).fold(0usize, usize::saturating_add);
    if most < count {
        return Err(wrong(format!("have {most} {what}, and the whole image has {count}")));
    }
    let Some((_, first)) = pieces.first() else { return Ok(Vec::new()) };
    for (_, arrays) in &pieces {
        alike(first, arrays)?;
    }
    let mut joined = Vec::new();
    for array in first.iter() {
        let numbers = count.checked_mul(array.components).ok_or_else(too_many)?;
        charge(&array.name, numbers as u64 * array.values.kind().size() as u64)?;
        joined.push(Array { values: array.values.kind().zeros(numbers), ..array.clone_head() });
    }
    let mut filled = vec![false; count];
    for (block, arrays) in pieces {
        let at = block.within(&whole).ok_or_else(|| {
            wrong(format!("reach beyond the image: one has {:?} {what} from {:?} on", block.size, block.from))
        })?;
        let row = block.size[0];
        for (i, (y, z)) in (0..block.size[2]).flat_map(|z| (0..block.size[1]).map(move |y| (y, z))).enumerate() {
            let to = at[0] + whole.size[0] * (at[1] + y + whole.size[1] * (at[2] + z));
            filled[to..to + row].fill(true);
            for (whole, piece) in joined.iter_mut().zip(*arrays) {
                let n = piece.components;
                if !whole.values.place(n * to, &piece.values, n * row * i, n * row) {
                    return Err(wrong(format!("have too few numbers in array `{}`", piece.name)));
                }
            }
        }
    }
    match filled.iter().position(|filled| !filled) {
        Some(missing) => Err(wrong(format!("leave out {what} of the image, the first is number {missing}"))),
        None => Ok(joined),
    }
}

/// Whether two pieces have the same arrays, in the same order.
pub(super) fn alike(first: &[Array], other: &[Array]) -> Result<(), Problem> {
    let shape = |array: &Array| (array.name.clone(), array.components, array.values.kind());
    let (a, b): (Vec<_>, Vec<_>) = (first.iter().map(shape).collect(), other.iter().map(shape).collect());
    if a == b {
        return Ok(());
    }
    let odd = a.iter().find(|x| !b.contains(x)).or_else(|| b.iter().find(|x| !a.contains(x))).or(a.first());
    let name = odd.map_or("", |(name, ..)| name);
    Err(Problem::Pieces { problem: format!("differ: array `{name}` isn't alike in all of them") })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(extent: [i64; 6], number: impl Fn(i64, i64, i64) -> f32) -> Piece {
        let [a, b, c, d, e, f] = extent;
        let values = |end: i64| -> Vec<f32> {
            let last = |from: i64, to: i64| if end == 1 && to > from { to - 1 } else { to };
            (e..=last(e, f))
                .flat_map(|z| (c..=last(c, d)).flat_map(move |y| (a..=last(a, b)).map(move |x| (x, y, z))))
                .map(|(x, y, z)| number(x, y, z))
                .collect()
        };
        let arrays = |end| vec![Array::new("f", 1, values(end))];
        Piece { extent, point_arrays: arrays(0), cell_arrays: arrays(1) }
    }

    #[test]
    fn pieces_of_an_image_become_the_whole() {
        let number = |x: i64, y: i64, z: i64| (100 * z + 10 * y + x) as f32;
        let free = |_: &str, _: u64| Ok(());
        for whole in [[-2, 3, 1, 4, 0, 2], [-2, 3, 1, 4, 5, 5], [0, 5, 0, 0, 0, 0]] {
            let right = piece(whole, number);
            let [a, b, c, d, e, f] = whole;
            for middle in a..=b {
                // Halves along x, alike at the seam and overlapping by more.
                for overlap in 0..=(b - middle).min(2) {
                    let halves = [[a, middle + overlap, c, d, e, f], [middle, b, c, d, e, f]].map(|e| piece(e, number));
                    let (points, cells) = image(whole, halves.into(), free).unwrap();
                    assert_eq!(points, right.point_arrays);
                    assert_eq!(cells, right.cell_arrays, "{whole:?} {middle} {overlap}");
                }
            }
        }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let number = |_, _, _| 1.0;
        let whole = [0, 3, 0, 1, 0, 1];
        let refused = |extents: &[[i64; 6]]| {
            let pieces = extents.iter().map(|&extent| piece(extent, number)).collect();
            image(whole, pieces, |_, _| Ok(())).unwrap_err().to_string()
        };
        for (extents, message) in [
            (&[[0, 1, 0, 1, 0, 1]][..], "have 8 points, and the whole image has 16"),
            (&[[0, 1, 0, 1, 0, 1], [0, 1, 0, 1, 0, 1]], "leave out points of the image, the first is number 2"),
            (&[[0, 1, 0, 1, 0, 1], [2, 4, 0, 1, 0, 1]], "reach beyond the image"),
            (&[[0, 1, 0, 1, 0, 1], [2, 3, 0, 1, 0, 1]], "have 2 cells, and the whole image has 3"),
        ] {
            assert!(refused(extents).contains(message), "{extents:?}: {}", refused(extents));
        }
        let mut odd = piece([2, 3, 0, 1, 0, 1], number);
        odd.point_arrays[0].name = "g".into();
        let error = image(whole, vec![piece([0, 2, 0, 1, 0, 1], number), odd], |_, _| Ok(())).unwrap_err();
        assert!(error.to_string().contains("array `f` isn't alike in all of them"), "{error}");
    }
}
