//! A `#[test]` that replaces the standard one, which reports the duration of a test on nightly compilers only.
//! `#[macro_use] extern crate pilotage_timed;` gives it precedence over that of the prelude.

use proc_macro::{Group, TokenStream, TokenTree};

/// The standard `#[test]`, whose body begins with `let _timed = crate::times::Timed::new("module::name");`.
#[proc_macro_attribute]
pub fn test(_arguments: TokenStream, function: TokenStream) -> TokenStream {
    let mut tokens: Vec<TokenTree> = function.into_iter().collect();
    let name = tokens.iter().skip_while(|token| token.to_string() != "fn");
    let name = name.take(2).last().map(TokenTree::to_string);
    if let (Some(TokenTree::Group(body)), Some(name)) = (tokens.last_mut(), name) {
        let timed = format!(
            "let _timed = crate::times::Timed::new(concat!(module_path!(), \"::{name}\"));"
        );
        let mut statements: TokenStream = timed.parse().unwrap_or_default();
        statements.extend(body.stream());
        let span = body.span();
        *body = Group::new(body.delimiter(), statements);
        body.set_span(span);
    }
    let mut test: TokenStream = "#[::core::prelude::v1::test]".parse().unwrap_or_default();
    test.extend(tokens);
    test
}
