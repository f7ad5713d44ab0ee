//! The text of a formula as a tree, by recursive descent: one method a line of the grammar above. Mistakes are placed by the
//! character at which they are noticed.

use super::{BINARY, Binary, CONSTANTS, Node, UNARY, Unary, Value, depends, evaluate};

/// How deep parentheses, signs and powers may nest.
const DEEPEST: usize = 64;

/// How many arguments min and max take.
const MOST_ARGUMENTS: usize = 1000;

/// Two or more arguments as a tree that is no deeper than it must be, in the order written. Min and max give the same
/// bits in whatever way their arguments are paired.
fn balanced(function: Binary, mut nodes: Vec<Node>) -> Node {
    match nodes.len() {
        0 => Node::Number(0.0), // a function's first argument is always there
        1 => nodes.swap_remove(0),
        n => {
            let rest = nodes.split_off(n / 2);
            Node::Binary(function, Box::new(balanced(function, nodes)), Box::new(balanced(function, rest)))
        }
    }
}

/// What is left of a formula.
pub(super) struct Parser<'a> {
    text: &'a str,
    rest: &'a str,
    axes: &'a [&'a str],
    depth: usize,
}

impl<'a> Parser<'a> {
    /// Before a formula in these axes.
    pub fn new(text: &'a str, axes: &'a [&'a str]) -> Self {
        Self { text, rest: text, axes, depth: 0 }
    }

    /// The whole formula, up to its end.
    pub fn whole(mut self) -> Result<Node, String> {
        let root = self.sum()?;
        match self.peek() {
            None => Ok(root),
            Some(')') => Err(self.wrong("this \")\" closes nothing")),
            Some(c) if c.is_alphanumeric() || c == '(' => {
                Err(self.wrong("expected an operator here; write 2*x for 2x"))
            }
            Some(_) => Err(self.wrong("expected an operator or the end here")),
        }
    }

    fn peek(&mut self) -> Option<char> {
        self.rest = self.rest.trim_start();
        self.rest.chars().next()
    }

    fn take(&mut self, wanted: char) -> bool {
        let found = self.peek() == Some(wanted);
        if found {
            self.rest = &self.rest[wanted.len_utf8()..];
        }
        found
    }

    fn wrong(&self, message: &str) -> String {
        let before = self.text[..self.text.len() - self.rest.len()].chars().count();
        match self.rest.split_whitespace().next() {
            None => format!("at the end: {message}"),
            Some(found) => {
                let found: String = found.chars().take(20).collect();
                format!("at character {} (\"{found}\"): {message}", before + 1)
            }
        }
    }

    fn deeper(&mut self) -> Result<(), String> {
        self.depth += 1;
        if self.depth > DEEPEST { Err(self.wrong(&format!("nests deeper than {DEEPEST} levels"))) } else { Ok(()) }
    }

    fn sum(&mut self) -> Result<Node, String> {
        self.chain([('+', Binary::Add), ('-', Binary::Subtract)], Self::product)
    }

    fn product(&mut self) -> Result<Node, String> {
        self.chain([('*', Binary::Multiply), ('/', Binary::Divide)], Self::sign)
    }

    fn chain(
        &mut self,
        operators: [(char, Binary); 2],
        operand: fn(&mut Self) -> Result<Node, String>,
    ) -> Result<Node, String> {
        let mut left = operand(self)?;
        let depth = self.depth;
        while let Some((_, operator)) = operators.into_iter().find(|(sign, _)| self.take(*sign)) {
            // A long chain is a deep tree.
            self.deeper()?;
            left = Node::Binary(operator, Box::new(left), Box::new(operand(self)?));
        }
        self.depth = depth;
        Ok(left)
    }

    fn sign(&mut self) -> Result<Node, String> {
        self.deeper()?;
        let node = if self.take('-') {
            Node::Unary(Unary::Negate, Box::new(self.sign()?))
        } else if self.take('+') {
            self.sign()?
        } else {
            self.power()?
        };
        self.depth -= 1;
        Ok(node)
    }

    fn power(&mut self) -> Result<Node, String> {
        let base = self.atom()?;
        if self.peek() == Some('*') && self.rest.starts_with("**") {
            return Err(self.wrong("write ^ for a power"));
        }
        if !self.take('^') {
            return Ok(base);
        }
        let exponent = self.sign()?;
        let whole = match depends(&exponent) {
            (false, false) => match evaluate(&exponent, &[], &[], &mut Vec::new()) {
                Value::Number(x) if x == x.trunc() && x.abs() <= 64.0 => Some(x as i32),
                _ => None,
            },
            _ => None,
        };
        Ok(match whole {
            Some(power) => Node::Whole(Box::new(base), power),
            None => Node::Binary(Binary::Power, Box::new(base), Box::new(exponent)),
        })
    }

    fn atom(&mut self) -> Result<Node, String> {
        match self.peek() {
            Some('(') => {
                self.take('(');
                let inner = self.sum()?;
                if !self.take(')') {
                    return Err(self.wrong("expected \")\""));
                }
                Ok(inner)
            }
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_alphabetic() => self.name(),
            _ => Err(self.wrong("expected a number, a name or \"(\"")),
        }
    }

    fn number(&mut self) -> Result<Node, String> {
        let bytes = self.rest.as_bytes();
        let digits = |from: usize| bytes[from..].iter().take_while(|b| b.is_ascii_digit() || **b == b'.').count();
        let mut end = digits(0);
        // An exponent only if digits follow: 2e is two and the name e.
        if matches!(bytes.get(end), Some(b'e' | b'E')) {
            let signed = end + 1 + usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
            let count = if signed <= bytes.len() { digits(signed) } else { 0 };
            end = if count > 0 { signed + count } else { end };
        }
        let value: Option<f64> = self.rest[..end].parse().ok().filter(|x: &f64| x.is_finite());
        let value = value.ok_or_else(|| self.wrong("this is no number"))?;
        self.rest = &self.rest[end..];
        Ok(Node::Number(value))
    }

    fn name(&mut self) -> Result<Node, String> {
        let end = self.rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(self.rest.len());
        let (name, here) = (&self.rest[..end], self.rest);
        if let Some(axis) = self.axes.iter().position(|axis| *axis == name) {
            self.rest = &here[end..];
            return Ok(Node::Axis(axis));
        }
        if let Some((_, value)) = CONSTANTS.iter().find(|(constant, _)| *constant == name) {
            self.rest = &here[end..];
            return Ok(Node::Number(*value));
        }
        let one = UNARY.iter().find(|(function, _)| *function == name).map(|(_, function)| *function);
        let two = BINARY.iter().find(|(function, _)| *function == name).map(|(_, function)| *function);
        if one.is_none() && two.is_none() {
            let functions = UNARY.iter().map(|(name, _)| *name).chain(BINARY.iter().map(|(name, _)| *name));
            let functions: Vec<&str> = functions.collect();
            let constants = CONSTANTS.map(|(name, _)| name).join(", ");
            let axes = self.axes.join(", ");
            let functions = functions.join(", ");
            return Err(self.wrong(&format!("known are {axes}, {constants} and the functions {functions}")));
        }
        self.rest = &here[end..];
        if !self.take('(') {
            return Err(self.wrong(&format!("expected \"(\" after {name}")));
        }
        let first = Box::new(self.sum()?);
        let node = match (one, two) {
            (Some(function), _) => Node::Unary(function, first),
            (None, Some(function)) => {
                if !self.take(',') {
                    return Err(self.wrong(&format!("expected \",\": {name} has two arguments or more")));
                }
                let mut arguments = vec![*first, self.sum()?];
                while matches!(function, Binary::Min | Binary::Max) && self.take(',') {
                    if arguments.len() == MOST_ARGUMENTS {
                        return Err(self.wrong(&format!("{name} takes at most {MOST_ARGUMENTS} arguments")));
                    }
                    arguments.push(self.sum()?);
                }
                balanced(function, arguments)
            }
            (None, None) => *first,
        };
        if !self.take(')') {
            return Err(self.wrong(&format!("expected \")\" after the argument of {name}")));
        }
        Ok(node)
    }
}
