/** Lint rules of the editor and its tests. Layout belongs to Prettier.
 *
 * Types are read by TypeScript 6 (the package "typescript"): TypeScript 7, which `npm run types` runs as the package
 * "@typescript/native", has no interface for linters yet.
 * The cache knows the files, not the types they import, so findings are confirmed without it, and only a check after
 * `rm -r node_modules/.cache` is complete. */
import eslint from "@eslint/js";
import { defineConfig } from "eslint/config";
import reactHooks from "eslint-plugin-react-hooks";
import tseslint from "typescript-eslint";

export default defineConfig(
  { ignores: ["dist/", "**/*.gen.ts"] },
  { linterOptions: { reportUnusedDisableDirectives: "error" } },
  {
    files: ["**/*.ts", "**/*.tsx"],
    extends: [eslint.configs.recommended, tseslint.configs.strictTypeChecked],
    languageOptions: { parserOptions: { projectService: true, tsconfigRootDir: import.meta.dirname } },
    plugins: { "react-hooks": reactHooks },
    rules: {
      eqeqeq: ["error", "always", { null: "ignore" }],
      "react-hooks/rules-of-hooks": "error",
      "react-hooks/exhaustive-deps": "error",
      // properties are checked more strictly than methods, and may be passed on without their object
      "@typescript-eslint/method-signature-style": "error",
      // "void signal.value;" subscribes to a signal
      "@typescript-eslint/no-meaningless-void-operator": "off",
      // "return act();" ends a function that returns nothing
      "@typescript-eslint/no-confusing-void-expression": "off",
      // "const { left, ...kept } = all;" leaves a field out
      "@typescript-eslint/no-unused-vars": ["error", { ignoreRestSiblings: true }],
      "@typescript-eslint/restrict-template-expressions": ["error", { allowNumber: true }],
      // a default case stands for the others
      "@typescript-eslint/switch-exhaustiveness-check": ["error", { considerDefaultExhaustiveForUnions: true }],
    },
  },
);
