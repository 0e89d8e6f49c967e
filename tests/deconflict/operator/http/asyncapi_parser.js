// Reads an AsyncAPI document from standard input with the official parser, and prints what is wrong with it.
const { Parser } = require("@asyncapi/parser");

const ERROR = 0, WARNING = 1;

new Parser().parse(require("fs").readFileSync(0, "utf8")).then(({ document, diagnostics }) => {
  const wrong = diagnostics.filter(({ severity }) => severity === ERROR || severity === WARNING);
  for (const { message, path } of wrong) console.log(`${path.join(".")}: ${message}`);
  process.exitCode = document && !wrong.length ? 0 : 1;
});
