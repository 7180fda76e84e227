// Builds the page into the package, under names that never change, so that what is committed can be compared with a
// fresh build. The output folder is that of the environment where a test names one.
declare const process: { env: Record<string, string | undefined> };

export default {
  base: "./",
  build: {
    outDir: process.env.FIRABLE_PAGE_OUT ?? "../cli/view/built",
    emptyOutDir: true,
    target: "es2022",
    modulePreload: { polyfill: false },
    rollupOptions: {
      output: {
        entryFileNames: "page.js",
        assetFileNames: "page[extname]",
        codeSplitting: false,
      },
    },
  },
};
