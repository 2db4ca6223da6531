//! Text tables whose columns fit their widest cells.

use std::fmt::{Display, Formatter, Result};

pub struct Table<const N: usize> {
    to_the_right: [bool; N],
    rows: Vec<[String; N]>,
}

impl<const N: usize> Table<N> {
    /// Takes headings. A leading `>` aligns the cells to the right.
    pub fn new(headings: [&str; N]) -> Self {
        let names = headings.map(|heading| heading.trim_start_matches('>').to_owned());
        Self { to_the_right: headings.map(|heading| heading.starts_with('>')), rows: vec![names] }
    }

    pub fn row(&mut self, cells: [&dyn Display; N]) {
        self.rows.push(cells.map(ToString::to_string));
    }
}

impl<const N: usize> Display for Table<N> {
    fn fmt(&self, to: &mut Formatter<'_>) -> Result {
        let widths: [usize; N] = std::array::from_fn(|column| {
            self.rows.iter().map(|row| row[column].chars().count()).max().unwrap_or_default()
        });
        for row in &self.rows {
            let cells: Vec<_> = row
                .iter()
                .zip(widths)
                .zip(self.to_the_right)
                .map(|((cell, width), to_the_right)| {
                    if to_the_right { format!("{cell:>width$}") } else { format!("{cell:<width$}") }
                })
                .collect();
            writeln!(to, "{}", cells.join("  ").trim_end())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_column_is_as_wide_as_its_widest_cell() {
        let mut table = Table::new(["a", ">long"]);
        table.row([&"wide", &1]);
        assert_eq!(table.to_string(), "a     long\nwide     1\n");
    }
}
