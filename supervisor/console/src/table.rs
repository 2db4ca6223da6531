//! Text tables; each column is as wide as its widest cell.

/// The side that is filled with blanks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    Left,
    Right,
}

pub struct Table<const N: usize> {
    columns: [Align; N],
    rows: Vec<[String; N]>,
}

impl<const N: usize> Table<N> {
    pub fn new(heading: [(&str, Align); N]) -> Self {
        Self {
            columns: heading.map(|(_, align)| align),
            rows: vec![heading.map(|(name, _)| name.to_owned())],
        }
    }

    pub fn row(&mut self, cells: [String; N]) {
        self.rows.push(cells);
    }
}

impl<const N: usize> std::fmt::Display for Table<N> {
    fn fmt(&self, to: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let width = |cell: &String| cell.chars().count();
        let widths: [usize; N] = std::array::from_fn(|column| {
            let cells = self.rows.iter().map(|row| width(&row[column]));
            cells.max().unwrap_or_default()
        });
        for row in &self.rows {
            let cells = row.iter().zip(widths).zip(self.columns);
            let cells = cells.map(|((cell, width), align)| match align {
                Align::Left => format!("{cell:<width$}"),
                Align::Right => format!("{cell:>width$}"),
            });
            writeln!(to, "{}", cells.collect::<Vec<_>>().join("  ").trim_end())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_column_is_as_wide_as_its_widest_cell() {
        let mut table = Table::new([("a", Align::Left), ("long", Align::Right)]);
        table.row(["wide".to_owned(), "1".to_owned()]);
        assert_eq!(table.to_string(), "a     long\nwide     1\n");
    }
}
