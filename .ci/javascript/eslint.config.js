import js from "@eslint/js";
import globals from "globals";

export default [
  { ignores: ["page/vendor/"] },
  js.configs.recommended,
  {
    files: ["page/**/*.js"],
    languageOptions: { ecmaVersion: 2022, sourceType: "module", globals: globals.browser },
    linterOptions: { reportUnusedDisableDirectives: "error" },
    rules: {
      curly: ["error", "multi-line"],
      eqeqeq: ["error", "always", { null: "ignore" }],
      "max-depth": ["error", 4],
      "max-lines": ["error", 300],
      // A function that makes a part holds all of it, as a class does.
      "max-lines-per-function": ["error", { max: 150 }],
      "no-alert": "error",
      "no-console": ["error", { allow: ["warn", "error"] }],
      "no-eval": "error",
      "no-implied-eval": "error",
      "no-shadow": "error",
      "no-unused-vars": ["error", { argsIgnorePattern: "^_" }],
      "no-var": "error",
      "object-shorthand": "error",
      "prefer-const": "error",
      // Text from the bus must never become markup.
      "no-restricted-properties": [
        "error",
        { property: "innerHTML", message: "Set textContent, or append elements." },
        { property: "outerHTML", message: "Set textContent, or append elements." },
        { property: "insertAdjacentHTML", message: "Set textContent, or append elements." },
      ],
    },
  },
];
