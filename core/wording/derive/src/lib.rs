//! `derive(Localized)`: an error as a sentence that can be reported in any language.
//!
//! The sentence is the one that `thiserror` prints: `#[error("…")]` is the template of a `Text`, and its values are those of
//! the message. A value that is an error of ours is translated as well, and so is a fixed phrase (`&'static str`) of several words; a value with a
//! format, such as `{mm:.1}`, is the same in every language. What has neither does not compile, so that no error gets
//! into a sentence in English only.

use proc_macro2::{Delimiter, Group, Ident, Span, TokenStream, TokenTree};
use quote::{format_ident, quote};
use syn::{Attribute, Data, DeriveInput, Error, Fields, LitStr, Result, Type};

/// `Text::from(&error)`, and the error as a value of other sentences. The package depends on `handeye_wording`.
#[proc_macro_derive(Localized)]
pub fn derive_localized(input: proc_macro::TokenStream) -> proc_macro::TokenStream {
    let input = syn::parse_macro_input!(input as DeriveInput);
    localized(&input).unwrap_or_else(|error| error.to_compile_error()).into()
}

fn localized(input: &DeriveInput) -> Result<TokenStream> {
    let name = &input.ident;
    let arms = match &input.data {
        Data::Enum(data) => {
            let arm = |variant: &syn::Variant| {
                let at = &variant.ident;
                arm(&quote!(#name::#at), at, &variant.attrs, &variant.fields)
            };
            data.variants.iter().map(arm).collect::<Result<Vec<_>>>()?
        }
        Data::Struct(data) => vec![arm(&quote!(#name), name, &input.attrs, &data.fields)?],
        Data::Union(_) => return Err(Error::new_spanned(name, "a union is no error")),
    };
    Ok(quote! {
        impl From<&#name> for ::handeye_wording::Text {
            fn from(error: &#name) -> Self {
                match error { #(#arms)* }
            }
        }
        impl From<#name> for ::handeye_wording::Text {
            fn from(error: #name) -> Self {
                Self::from(&error)
            }
        }
        impl From<&#name> for ::handeye_wording::Value {
            fn from(error: &#name) -> Self {
                Self::Text(error.into())
            }
        }
        impl From<#name> for ::handeye_wording::Value {
            fn from(error: #name) -> Self {
                Self::Text(error.into())
            }
        }
        impl From<&Box<#name>> for ::handeye_wording::Value {
            fn from(error: &Box<#name>) -> Self {
                Self::Text((&**error).into())
            }
        }
    })
}

/// The arm of one variant.
fn arm(path: &TokenStream, name: &Ident, attributes: &[Attribute], fields: &Fields) -> Result<TokenStream> {
    let message = attributes.iter().find(|attribute| attribute.path().is_ident("error"));
    let message = message.ok_or_else(|| Error::new_spanned(name, "it has no #[error(\"…\")]"))?;
    let mut tokens = message.meta.require_list()?.tokens.clone().into_iter();
    let bindings: Vec<Ident> = fields.iter().enumerate().map(|(at, field)| binding(at, field.ident.as_ref())).collect();
    let pattern = match fields {
        Fields::Named(_) => quote!(#path { #(#bindings),* }),
        Fields::Unnamed(_) => quote!(#path(#(#bindings),*)),
        Fields::Unit => quote!(#path),
    };
    let first = tokens.next().ok_or_else(|| Error::new_spanned(name, "its message is empty"))?;
    if let TokenTree::Ident(_) = &first {
        let inner = bindings.first().ok_or_else(|| Error::new_spanned(name, "nothing is in it"))?;
        return Ok(quote!(#pattern => ::handeye_wording::Text::from(#inner),));
    }
    let format = syn::parse2::<LitStr>(TokenStream::from(first))?;
    let arguments = arguments(&tokens.skip(1).collect::<Vec<_>>());
    let (template, placeholders) = parts(&format.value());
    let mut values = Vec::new();
    for (name, spec) in placeholders {
        if name.is_empty() {
            return Err(Error::new(format.span(), "the value needs a name, which the translation calls it by"));
        }
        let (value, fixed) = if let Some((_, expression)) = arguments.iter().find(|(named, _)| *named == name) {
            (expression.clone(), false)
        } else {
            let ident = name.parse::<usize>().map_or_else(|_| format_ident!("{name}"), |at| format_ident!("_{at}"));
            let field = bindings.iter().position(|binding| *binding == ident);
            let fixed = field.and_then(|at| fields.iter().nth(at)).is_some_and(|field| is_phrase(&field.ty));
            (quote!(#ident), fixed)
        };
        values.push(if !spec.is_empty() {
            let formatted = LitStr::new(&format!("{{{spec}}}"), Span::call_site());
            quote!((#name, ::handeye_wording::Value::from(format!(#formatted, #value))))
        } else if fixed {
            quote!((#name, ::handeye_wording::Value::phrase(*#value)))
        } else {
            quote!((#name, ::handeye_wording::Value::from(#value)))
        });
    }
    Ok(quote! {
        #[allow(unused_variables, clippy::allow_attributes)]
        #pattern => ::handeye_wording::Text::new(#template, vec![#(#values),*]),
    })
}

fn binding(at: usize, name: Option<&Ident>) -> Ident {
    name.cloned().unwrap_or_else(|| format_ident!("_{at}"))
}

/// `&'static str`: words of our own.
fn is_phrase(of: &Type) -> bool {
    matches!(of, Type::Reference(reference) if reference.lifetime.as_ref().is_some_and(|lifetime| lifetime.ident == "static"))
}

/// The template of a message, without formats, and the names and formats (with their colon) of its values.
fn parts(message: &str) -> (String, Vec<(String, String)>) {
    let (mut template, mut found, mut rest) = (String::new(), Vec::new(), message);
    while let Some((before, after)) = rest.split_once('{') {
        let (inside, after) = after.split_once('}').unwrap_or((after, ""));
        let (name, spec) = inside.find(':').map_or((inside, ""), |colon| inside.split_at(colon));
        template.push_str(before);
        template.push('{');
        template.push_str(name);
        template.push('}');
        found.push((name.to_owned(), spec.to_owned()));
        rest = after;
    }
    template.push_str(rest);
    (template, found)
}

/// Expressions after the message, with their names. `.field` is the field, as for `thiserror`.
fn arguments(tokens: &[TokenTree]) -> Vec<(String, TokenStream)> {
    let is_comma = |token: &TokenTree| matches!(token, TokenTree::Punct(punct) if punct.as_char() == ',');
    let parts = tokens.split(is_comma).filter(|part| !part.is_empty());
    parts
        .filter_map(|part| match part {
            [TokenTree::Ident(name), TokenTree::Punct(_), value @ ..] => Some((name.to_string(), fields_named(value))),
            _ => None,
        })
        .collect()
}

fn fields_named(tokens: &[TokenTree]) -> TokenStream {
    let mut named = Vec::new();
    let mut tokens = tokens.iter().cloned().peekable();
    while let Some(token) = tokens.next() {
        let begins = matches!(named.last(), None | Some(TokenTree::Punct(_)));
        match (token, tokens.peek()) {
            (TokenTree::Punct(dot), Some(TokenTree::Ident(_))) if dot.as_char() == '.' && begins => {}
            (TokenTree::Punct(dot), Some(TokenTree::Literal(number))) if dot.as_char() == '.' && begins => {
                let field = format_ident!("_{}", number.to_string());
                tokens.next();
                named.push(TokenTree::Ident(field));
            }
            (TokenTree::Group(group), _) => {
                let inner: Vec<TokenTree> = group.stream().into_iter().collect();
                let inner = if group.delimiter() == Delimiter::Brace { group.stream() } else { fields_named(&inner) };
                named.push(TokenTree::Group(Group::new(group.delimiter(), inner)));
            }
            (token, _) => named.push(token),
        }
    }
    named.into_iter().collect()
}
