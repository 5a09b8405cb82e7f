"""The studio: a local server and one page in the browser, to see every stage, correct it by hand, and take the model away.

The studio calls the pipeline and holds no geometry of its own. A project is a folder with a list of edits; whatever is seen follows
from the scan and that list, so that nothing is lost when the page or the server goes away, and the command line can do it again.
"""
