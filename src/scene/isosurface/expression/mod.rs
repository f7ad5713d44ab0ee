//! Formulas in x, y, z and w, as a pipeline writes them: parsed once, evaluated a row of points at a time.
//!
//! A row differs in x only, so most of a formula is a number for the whole row, and what depends on x alone is the same
//! for all rows: it is computed once for the grid. What is left runs over the row in plain loops. Functions come from
//! `libm`, not from the platform, and whole powers are products, so that a formula gives the same bits everywhere.
//!
//! ```text
//! sum     = product { ("+" | "-") product }
//! product = sign { ("*" | "/") sign }
//! sign    = ("-" | "+") sign | power
//! power   = atom [ "^" sign ]                   so that -x^2 = -(x^2), 2^-x is allowed and 2^3^2 = 2^(3^2)
//! atom    = number | name | name "(" sum { "," sum } ")" | "(" sum ")"
//! ```
//!
//! Why not by a crate: of those at hand `meval` and `fasteval` are no longer kept, `evalexpr` is under the AGPL, `exmex`
//! takes -x^2 for (-x)^2, and all evaluate point by point with the platform's functions.

mod parse;

use parse::Parser;

/// Functions of one argument.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Unary {
    Negate,
    Sqrt,
    Abs,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sinh,
    Cosh,
    Tanh,
    Exp,
    Ln,
    Floor,
}

/// Operators and functions of two arguments.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Binary {
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Min,
    Max,
    Atan2,
    Mod,
}

const UNARY: [(&str, Unary); 14] = [
    ("sqrt", Unary::Sqrt),
    ("abs", Unary::Abs),
    ("sin", Unary::Sin),
    ("cos", Unary::Cos),
    ("tan", Unary::Tan),
    ("asin", Unary::Asin),
    ("acos", Unary::Acos),
    ("atan", Unary::Atan),
    ("sinh", Unary::Sinh),
    ("cosh", Unary::Cosh),
    ("tanh", Unary::Tanh),
    ("exp", Unary::Exp),
    ("ln", Unary::Ln),
    ("floor", Unary::Floor),
];

const BINARY: [(&str, Binary); 4] =
    [("min", Binary::Min), ("max", Binary::Max), ("atan2", Binary::Atan2), ("mod", Binary::Mod)];

const CONSTANTS: [(&str, f64); 3] =
    [("pi", std::f64::consts::PI), ("tau", std::f64::consts::TAU), ("e", std::f64::consts::E)];

#[derive(Clone, Debug, PartialEq)]
enum Node {
    Number(f64),
    Axis(usize),
    Unary(Unary, Box<Node>),
    Binary(Binary, Box<Node>, Box<Node>),
    /// A whole power, by repeated multiplication.
    Whole(Box<Node>, i32),
    /// What depends on x alone, at each x of the grid.
    Row(Vec<f64>),
}

/// A formula.
#[derive(Clone, Debug, PartialEq)]
pub struct Expression {
    root: Node,
}

impl Expression {
    /// Parses a formula in the first `axes` of x, y, z, w.
    pub fn parse(text: &str, axes: &[&str]) -> Result<Self, String> {
        Ok(Self { root: Parser::new(text, axes).whole()? })
    }

    /// The same formula for rows with these x.
    pub fn along(&self, xs: &[f64]) -> Rows {
        let mut root = self.root.clone();
        fix(&mut root, xs);
        Rows { root, xs: xs.to_vec() }
    }
}

/// A formula made ready for the rows of a grid.
#[derive(Clone, Debug)]
pub struct Rows {
    root: Node,
    xs: Vec<f64>,
}

impl Rows {
    /// The values along a row; `at` holds its y, z and w, as far as there are any. `buffers` are used again.
    pub fn evaluate(&self, at: &[f64], buffers: &mut Vec<Vec<f64>>, mut each: impl FnMut(usize, f64)) {
        match evaluate(&self.root, at, &self.xs, buffers) {
            Value::Number(value) => (0..self.xs.len()).for_each(|i| each(i, value)),
            Value::Row(row) => {
                row.iter().enumerate().for_each(|(i, &value)| each(i, value));
                buffers.push(row);
            }
        }
    }
}

/// Whether the node has x in it, and whether it has any other axis.
fn depends(node: &Node) -> (bool, bool) {
    match node {
        Node::Number(_) => (false, false),
        Node::Axis(axis) => (*axis == 0, *axis != 0),
        Node::Row(_) => (true, false),
        Node::Unary(_, a) | Node::Whole(a, _) => depends(a),
        Node::Binary(_, a, b) => {
            let (a, b) = (depends(a), depends(b));
            (a.0 || b.0, a.1 || b.1)
        }
    }
}

/// Replaces numbers and what depends on x alone by their values.
fn fix(node: &mut Node, xs: &[f64]) {
    if let (_, false) = depends(node) {
        let fixed = match evaluate(node, &[], xs, &mut Vec::new()) {
            Value::Number(value) => Node::Number(value),
            Value::Row(row) => Node::Row(row),
        };
        *node = fixed;
        return;
    }
    match node {
        Node::Unary(_, a) | Node::Whole(a, _) => fix(a, xs),
        Node::Binary(_, a, b) => {
            fix(a, xs);
            fix(b, xs);
        }
        _ => {}
    }
}

enum Value {
    Number(f64),
    Row(Vec<f64>),
}

fn evaluate(node: &Node, at: &[f64], xs: &[f64], buffers: &mut Vec<Vec<f64>>) -> Value {
    let filled = |row: &[f64], buffers: &mut Vec<Vec<f64>>| {
        let mut copy = buffers.pop().unwrap_or_default();
        copy.clear();
        copy.extend_from_slice(row);
        Value::Row(copy)
    };
    match node {
        Node::Number(value) => Value::Number(*value),
        Node::Axis(0) => filled(xs, buffers),
        Node::Axis(axis) => Value::Number(at.get(axis - 1).copied().unwrap_or(0.0)),
        Node::Row(row) => filled(row, buffers),
        Node::Unary(function, a) => unary(*function, evaluate(a, at, xs, buffers)),
        Node::Whole(a, power) => map(evaluate(a, at, xs, buffers), |x| whole_power(x, *power)),
        Node::Binary(function, a, b) => {
            let a = evaluate(a, at, xs, buffers);
            let b = evaluate(b, at, xs, buffers);
            binary(*function, a, b, buffers)
        }
    }
}

fn map(value: Value, function: impl Fn(f64) -> f64) -> Value {
    match value {
        Value::Number(x) => Value::Number(function(x)),
        Value::Row(mut row) => {
            row.iter_mut().for_each(|x| *x = function(*x));
            Value::Row(row)
        }
    }
}

fn unary(function: Unary, value: Value) -> Value {
    match function {
        Unary::Negate => map(value, |x| -x),
        Unary::Sqrt => map(value, f64::sqrt),
        Unary::Abs => map(value, f64::abs),
        Unary::Floor => map(value, f64::floor),
        Unary::Sin => map(value, libm::sin),
        Unary::Cos => map(value, libm::cos),
        Unary::Tan => map(value, libm::tan),
        Unary::Asin => map(value, libm::asin),
        Unary::Acos => map(value, libm::acos),
        Unary::Atan => map(value, libm::atan),
        Unary::Sinh => map(value, libm::sinh),
        Unary::Cosh => map(value, libm::cosh),
        Unary::Tanh => map(value, libm::tanh),
        Unary::Exp => map(value, libm::exp),
        Unary::Ln => map(value, libm::log),
    }
}

fn zip(a: Value, b: Value, buffers: &mut Vec<Vec<f64>>, function: impl Fn(f64, f64) -> f64) -> Value {
    match (a, b) {
        (a, Value::Number(y)) => map(a, |x| function(x, y)),
        (Value::Number(x), b) => map(b, |y| function(x, y)),
        (Value::Row(mut a), Value::Row(b)) => {
            a.iter_mut().zip(&b).for_each(|(x, &y)| *x = function(*x, y));
            buffers.push(b);
            Value::Row(a)
        }
    }
}

fn binary(function: Binary, a: Value, b: Value, buffers: &mut Vec<Vec<f64>>) -> Value {
    match function {
        Binary::Add => zip(a, b, buffers, |x, y| x + y),
        Binary::Subtract => zip(a, b, buffers, |x, y| x - y),
        Binary::Multiply => zip(a, b, buffers, |x, y| x * y),
        Binary::Divide => zip(a, b, buffers, |x, y| x / y),
        // Plain comparisons: a NaN on either side must not vanish, as f64::min would have it.
        Binary::Min => zip(a, b, buffers, |x, y| if x < y || x.is_nan() { x } else { y }),
        Binary::Max => zip(a, b, buffers, |x, y| if x > y || x.is_nan() { x } else { y }),
        Binary::Power => zip(a, b, buffers, libm::pow),
        Binary::Atan2 => zip(a, b, buffers, libm::atan2),
        Binary::Mod => zip(a, b, buffers, |x, y| x - y * (x / y).floor()),
    }
}

fn whole_power(x: f64, power: i32) -> f64 {
    let (mut product, mut square, mut rest) = (1.0, x, power.unsigned_abs());
    while rest > 0 {
        if rest % 2 == 1 {
            product *= square;
        }
        square *= square;
        rest /= 2;
    }
    if power < 0 { 1.0 / product } else { product }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AXES: [&str; 4] = ["x", "y", "z", "w"];

    fn at(text: &str, point: [f64; 4]) -> f64 {
        let rows = Expression::parse(text, &AXES).unwrap_or_else(|e| panic!("{text}: {e}")).along(&[9.0, point[0]]);
        let mut value = f64::NAN;
        rows.evaluate(&point[1..], &mut Vec::new(), |i, v| {
            if i == 1 {
                value = v;
            }
        });
        value
    }

    #[test]
    fn arithmetic() {
        let p = [2.0, 3.0, 5.0, 7.0];
        for (text, expected) in [
            ("1", 1.0),
            ("x + y*z - w", 2.0 + 15.0 - 7.0),
            ("-x^2", -4.0),
            ("(-x)^2", 4.0),
            ("2^3^2", 512.0),
            ("2^-x", 0.25),
            ("w - z - y", -1.0),
            ("w / z / y", 7.0 / 5.0 / 3.0),
            ("--x", 2.0),
            ("x*-y", -6.0),
            ("1.5e1 + .5 + 2.", 17.5),
            ("sqrt(x^2 + y^2)", 13f64.sqrt()),
            ("min(x, y, -z)", -5.0),
            ("max(x, y, z, w, 1)", 7.0),
            ("abs(-w) + floor(-1.5)", 5.0),
            ("mod(-x, 3)", 1.0),
            ("2*pi - tau + e", std::f64::consts::E),
            ("x^0.5", 2f64.sqrt()),
            ("x^y", 8.0),
            ("y^-2", 1.0 / 9.0),
            (" x\n+\ty ", 5.0),
        ] {
            let found = at(text, p);
            assert!((found - expected).abs() <= 4e-16 * expected.abs(), "{text}: {found}, expected {expected}");
        }
        let trigonometry = "sin(x)^2 + cos(x)^2 + tanh(y) - sinh(y)/cosh(y) + atan2(y, x) - atan(y/x) + ln(exp(z))";
        assert!((at(trigonometry, p) - 6.0).abs() < 1e-14);
        assert!(at("min(1, sqrt(-x))", p).is_nan() && at("max(sqrt(-x), 1)", p).is_nan());
    }

    #[test]
    fn rows_agree_with_points() {
        let text = "max(abs(sin(x)*cos(y) + sin(y)*cos(z) + x*w^3) - 0.3*x, (x+1)^2/(y-z)) - x/2^x";
        let xs: Vec<f64> = (0..50).map(|i| 0.1 * f64::from(i) - 2.0).collect();
        let rows = Expression::parse(text, &AXES).unwrap().along(&xs);
        let mut buffers = Vec::new();
        for k in 0..5 {
            let (y, z, w) = (0.3 * f64::from(k), 1.7, -0.2 * f64::from(k));
            rows.evaluate(&[y, z, w], &mut buffers, |i, value| {
                assert_eq!(value.to_bits(), at(text, [xs[i], y, z, w]).to_bits());
            });
        }
    }

    #[test]
    fn mistakes_are_placed() {
        for (text, message) in [
            ("", "at the end: expected a number, a name or \"(\""),
            ("x +", "at the end: expected a number, a name or \"(\""),
            ("2x", "at character 2 (\"x\"): expected an operator here; write 2*x for 2x"),
            ("x ** 2", "at character 3 (\"**\"): write ^ for a power"),
            ("(x", "at the end: expected \")\""),
            ("x)", "at character 2 (\")\"): this \")\" closes nothing"),
            ("sin x", "at character 5 (\"x\"): expected \"(\" after sin"),
            ("max(x)", "at character 6 (\")\"): expected \",\": max has two arguments or more"),
            ("1..2", "at character 1 (\"1..2\"): this is no number"),
            ("1e999", "at character 1 (\"1e999\"): this is no number"),
            ("x = 1", "at character 3 (\"=\"): expected an operator or the end here"),
        ] {
            assert_eq!(Expression::parse(text, &AXES).unwrap_err(), message, "{text}");
        }
        let unknown = Expression::parse("x + foo", &AXES).unwrap_err();
        assert!(
            unknown.starts_with("at character 5 (\"foo\"): known are x, y, z, w, pi, tau, e and the functions sqrt")
        );
        assert!(Expression::parse("w", &AXES[..3]).unwrap_err().contains("known are x, y, z, pi"));
        for deep in ["(".repeat(100_000), "-".repeat(100_000), "2^".repeat(100_000), "x+".repeat(100_000)] {
            assert!(Expression::parse(&deep, &AXES).unwrap_err().contains("nests deeper"));
        }
    }
}
