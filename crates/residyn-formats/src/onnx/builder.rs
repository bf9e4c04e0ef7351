//! Builds a graph of ONNX operators.

use super::proto::{
    Attribute, Dimension, FLOAT, Graph, INT, INT64, Node, Shape, Size, Tensor, TensorType,
    ValueInfo, ValueType,
};

/// A value in the graph: a column `[batch, 1]`, a matrix `[batch, k]`, or a scalar that does not depend on the batch.
#[derive(Debug, Clone, PartialEq)]
pub struct Value {
    pub name: String,
    pub batched: bool,
}

#[derive(Debug, Default)]
pub struct Builder {
    graph: Graph,
    values: usize,
}

impl Builder {
    /// A new input `[batch, width]`.
    pub fn input(&mut self, name: &str, width: usize, about: &str) -> Value {
        self.graph.input.push(info(name, width, about));
        Value {
            name: name.to_owned(),
            batched: true,
        }
    }

    /// Make a matrix `[batch, width]` an output of this name.
    pub fn output(&mut self, name: &str, value: &Value, width: usize, about: &str) {
        let node = node("Identity", &[&value.name], &[name]);
        self.graph.node.push(node);
        self.graph.output.push(info(name, width, about));
    }

    /// A constant.
    pub fn parameter(&mut self, name: &str, value: f64, about: &str) -> Value {
        self.initializer(name, vec![], &[value], about)
    }

    pub fn constant(&mut self, value: f64) -> Value {
        // Named by value: each number is stored once.
        let name = format!("{value:e}");
        self.initializer(&name, vec![], &[value], "")
    }

    /// Named numbers; the same name again returns the same tensor.
    #[allow(clippy::cast_possible_truncation)] // the graph is in single precision
    pub fn initializer(
        &mut self,
        name: &str,
        dims: Vec<usize>,
        values: &[f64],
        about: &str,
    ) -> Value {
        let bytes = values.iter().flat_map(|x| (*x as f32).to_le_bytes());
        self.store(Tensor {
            dims: dims.iter().map(|d| *d as i64).collect(),
            data_type: FLOAT,
            name: name.to_owned(),
            raw_data: bytes.collect(),
            doc_string: about.to_owned(),
        });
        Value {
            name: name.to_owned(),
            batched: false,
        }
    }

    fn store(&mut self, tensor: Tensor) {
        let mut stored = self.graph.initializer.iter();
        if !stored.any(|known| known.name == tensor.name) {
            self.graph.initializer.push(tensor);
        }
    }

    /// An operator with one result.
    pub fn apply(&mut self, operator: &str, arguments: &[&Value]) -> Value {
        self.apply_with(operator, arguments, vec![])
    }

    pub fn apply_with(
        &mut self,
        operator: &str,
        arguments: &[&Value],
        attributes: Vec<Attribute>,
    ) -> Value {
        let value = self.fresh(arguments.iter().any(|argument| argument.batched));
        let names: Vec<&str> = arguments.iter().map(|a| a.name.as_str()).collect();
        self.graph.node.push(Node {
            attribute: attributes,
            ..node(operator, &names, &[&value.name])
        });
        value
    }

    /// The columns of a matrix.
    pub fn split(&mut self, matrix: &Value, width: usize) -> Vec<Value> {
        if width == 1 {
            return vec![matrix.clone()];
        }
        let sizes = format!("{width} columns");
        self.store(Tensor {
            dims: vec![width as i64],
            data_type: INT64,
            name: sizes.clone(),
            raw_data: 1_i64.to_le_bytes().repeat(width),
            doc_string: String::new(),
        });
        let columns: Vec<Value> = (0..width).map(|_| self.fresh(true)).collect();
        let names: Vec<&str> = columns.iter().map(|c| c.name.as_str()).collect();
        self.graph.node.push(Node {
            attribute: vec![whole("axis", 1)],
            ..node("Split", &[&matrix.name, &sizes], &names)
        });
        columns
    }

    /// A matrix of these columns. Scalars are expanded to the batch size of `like`.
    pub fn concat(&mut self, columns: &[Value], like: &Value) -> Value {
        let columns: Vec<Value> = columns.iter().map(|c| self.spread(c, like)).collect();
        let columns: Vec<&Value> = columns.iter().collect();
        self.apply_with("Concat", &columns, vec![whole("axis", 1)])
    }

    fn spread(&mut self, value: &Value, like: &Value) -> Value {
        if value.batched {
            return value.clone();
        }
        let shape = self.apply("Shape", &[like]);
        self.apply("Expand", &[value, &shape])
    }

    fn fresh(&mut self, batched: bool) -> Value {
        self.values += 1;
        Value {
            name: format!("v{}", self.values),
            batched,
        }
    }

    pub fn finish(mut self, name: &str) -> Graph {
        name.clone_into(&mut self.graph.name);
        self.graph
    }
}

/// An integer attribute.
pub fn whole(name: &str, value: i64) -> Attribute {
    Attribute {
        name: name.to_owned(),
        i: Some(value),
        kind: INT,
    }
}

fn node(operator: &str, inputs: &[&str], outputs: &[&str]) -> Node {
    let owned = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    Node {
        input: owned(inputs),
        output: owned(outputs),
        op_type: operator.to_owned(),
        attribute: vec![],
    }
}

/// A matrix with a free number of rows.
fn info(name: &str, width: usize, about: &str) -> ValueInfo {
    let sizes = [Size::Name("batch".to_owned()), Size::Value(width as i64)];
    let dim = sizes.map(|size| Dimension { size: Some(size) }).to_vec();
    let tensor = TensorType {
        elem_type: FLOAT,
        shape: Some(Shape { dim }),
    };
    ValueInfo {
        name: name.to_owned(),
        kind: Some(ValueType {
            tensor: Some(tensor),
        }),
        doc_string: about.to_owned(),
    }
}
