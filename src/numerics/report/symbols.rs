//! Names of parameters → the symbols that people write, the same in summary and page.

/// The symbol of a parameter's name in the tables: `θ₁` for `theta_1`, `α₂` for `alpha_2`, `base z` for `base_z`; a session after it
/// stays as it is, as in `base z of mon`.
pub fn symbol(name: &str) -> String {
    match name.split_once(" of ") {
        Some((parameter, session)) => format!("{} of {session}", of_parameter(parameter)),
        None => of_parameter(name),
    }
}

fn of_parameter(name: &str) -> String {
    let Some((quantity, place)) = name.rsplit_once('_') else { return name.to_owned() };
    let letter = match quantity {
        "theta" => "θ",
        "alpha" => "α",
        "beta" => "β",
        "a" | "d" => quantity,
        _ => return name.replace('_', " "),
    };
    let below = |digit: char| char::from_u32(0x2080 + digit.to_digit(10)?);
    let joint: Option<String> = place.chars().map(below).collect();
    joint.map_or_else(|| name.to_owned(), |joint| format!("{letter}{joint}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_have_the_symbols_of_textbooks() {
        let symbols = ["theta_1", "alpha_12", "a_2", "d_6", "beta_3"].map(symbol);
        assert_eq!(symbols, ["θ₁", "α₁₂", "a₂", "d₆", "β₃"]);
        assert_eq!(symbol("base_rz of mon of may"), "base rz of mon of may");
        assert_eq!(symbol("command_weight_3"), "command weight 3");
        assert_eq!(symbol("joint"), "joint");
    }
}
