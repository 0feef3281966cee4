// Elements of the page.

/** The element with this id. */
export const $ = (id) => document.getElementById(id);

/** A new element. */
export function made(name, properties, ...children) {
  const element = Object.assign(document.createElement(name), properties);
  element.append(...children);
  return element;
}
